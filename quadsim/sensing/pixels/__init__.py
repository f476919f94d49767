"""Find gates in pictures: their edges are predicted from the estimate, and searched for nearby.

edges.py         the edges that separate a frame from its background, and points on them
signal.py        the amount of the gates' colour in a pixel; its steps along lines
lines.py         a line through the steps of each edge, corners where two lines meet
pose_fit.py      the pose that fits the lines of all gates
hypotheses.py    the pose that explains a picture best, if the estimate is too uncertain
network.py       the network that finds gates without an estimate
network_pose.py  the pose that explains the gates that the network has found
tracker.py       all these steps, for one picture
"""
