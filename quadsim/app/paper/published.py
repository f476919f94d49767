"""The numbers of Vlahov, Gibson, Theodorou: "Low Frequency Sampling in Model Predictive Path Integral Control",
IEEE RA-L 2024."""

# Table II: (sampler, sigma) -> accumulated cost, its standard deviation over 1000 runs, ms a step on an RTX 3080
TABLE2 = {
    ("gaussian", 0.5): (27919.0, 33.1, 0.259),
    ("smooth", 0.5): (61328.7, 1766.8, 0.296),
    ("smooth_star", 0.5): (21853.6, 19189.7, 0.295),
    ("log_normal", 0.5): (24545.3, 40.3, 0.297),
    ("colored_1", 0.5): (13569.7, 65.4, 0.379),
    ("colored_2", 0.5): (14201.7, 61.2, 0.379),
    ("gaussian", 1.5): (13815.5, 64.6, 0.259),
    ("smooth", 1.5): (44401.0, 3232.3, 0.293),
    ("smooth_star", 1.5): (11446.3, 71.1, 0.294),
    ("log_normal", 1.5): (7316.1, 324.5, 0.299),
    ("colored_1", 1.5): (10636.9, 74.4, 0.379),
    ("colored_2", 1.5): (11081.2, 75.6, 0.379),
    ("gaussian", 3.0): (10815.1, 75.7, 0.259),
    ("smooth", 3.0): (68088.2, 7521.7, 0.293),
    ("smooth_star", 3.0): (10505.5, 75.6, 0.294),
    ("log_normal", 3.0): (6963.5, 380.5, 0.307),
    ("colored_1", 3.0): (9191.7, 69.6, 0.380),
    ("colored_2", 3.0): (9700.0, 70.2, 0.380),
}

# Table I: (system, sampler) -> mean, standard deviation and least time [s] of the valid attempts; valid, attempts
TABLE1 = {
    ("offroad", "gaussian"): (None, None, None, 0, None),  # how many attempts is not said
    ("offroad", "colored"): (38.333, 3.316, 35.99, 5, 6),
    ("quadrotor", "gaussian"): (8.547, 0.206, 8.360, 9, 37),
    ("quadrotor", "colored"): (8.691, 0.457, 7.695, 9, 21),
}
