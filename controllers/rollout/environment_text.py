"""The text of the loops that step many environments, filled in by controllers.rollout.environment.

LLVM vectorises a lane loop only where it sees that what is written overlaps with nothing that is read. So the lane
loops write to arrays made in the same function, whose rows lie where the compiler knows, and `move` brings rows to and
from the arguments. Those arrays serve many blocks: making them took longer than a step.
"""

RESTART = """
@inline
def drawn(seed, environment, episode, of):
    h = np.uint64(seed) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(environment) * np.uint64(0xD1B54A32D192ED03)
    h += np.uint64(episode) * np.uint64(0x8CB92BA72F3D8DD7)
    h = (h ^ (h >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    h = (h ^ (h >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return np.int64((h ^ (h >> np.uint64(31))) % np.uint64(of))

@njit(fastmath=FAST, error_model="numpy")
def restart(l, environment, seed, starts, targets, X, A, P, last, room, row, steps, passes, episode, obs):
    s = starts[drawn(seed, environment, episode[l], starts.shape[0])]
    for k in range({n_x}):
        X[k, l] = s[k]
    row[l] = np.int32(s[{n_x}])
    for k in range({n_p}):
        P[k, l] = s[{n_x} + 1 + k]
    for k in range({n_u}):
        last[k, l] = s[{n_x} + 1 + {n_p} + k]
    for k in range({n_row}):
        A[k, l] = targets[row[l], k]
    room[l] = F(0)
    steps[l] = 0
    passes[l] = 0
    episode[l] += 1
    o = observation(({x},), ({gates},), ({last},))
    {store_obs}

@kept
@njit(fastmath=FAST, error_model="numpy", parallel=True)
def begin(X, A, P, last, way, room, row, steps, passes, episode, over, obs, starts, targets, course, seed, chosen):
    for b in prange(X.shape[0]):
        for l in range(L):
            if chosen[b, l]:
                restart(l, b * L + l, seed, starts[course[b]], targets[course[b]], X[b], A[b], P[b], last[b], room[b],
                        row[b], steps[b], passes[b], episode[b], obs[b])
                over[b, l] = False
"""

PARTS = """
from controllers.rollout.normals import normal_rows

@njit
def move(source, to):
    for k in range(to.shape[0]):
        for l in range(L):
            to[k, l] = source[k, l]

@njit(fastmath=FAST, error_model="numpy")
def meet_obstacles(X, Y, moved, room, crashed, obstacles):
    # room: no box around an obstacle is nearer [m]; only who has flown so far looks at the obstacles again
    near = np.int32(0)
    for l in range(L):
        room[l] -= moved[l]
        near |= np.int32(1) if room[l] < F(0) else np.int32(0)
    if near == 0:
        return
    for l in range(L):
        if room[l] < F(0):
            p0, p1 = (X[0, l], X[1, l], X[2, l]), (Y[0, l], Y[1, l], Y[2, l])
            reach, least = moved[l] + F({slack}), F(1e12)
            for o in range(obstacles.shape[0]):
                {read_box}
                x = higher(higher(o0 - p1[0], p1[0] - o3), F(0))
                y = higher(higher(o1 - p1[1], p1[1] - o4), F(0))
                z = higher(higher(o2 - p1[2], p1[2] - o5), F(0))
                apart = x * x + y * y + z * z
                least = lower(least, apart)
                if apart <= reach * reach:
                    {read_obstacle}
                    if touches(p0, p1, ({obstacle})):
                        crashed[l] = F(1)
            room[l] = math.sqrt(least) - F({slack})

@njit(fastmath=FAST, error_model="numpy")
def next_targets(A, row, passes, hit, targets, final_row):
    hits = np.int32(0)
    for l in range(L):
        hits |= hit[l]
    if hits > 0:
        for l in range(L):
            if hit[l] > 0 and row[l] < final_row:
                row[l] += 1
                passes[l] += 1
                for k in range({n_row}):
                    A[k, l] = targets[row[l], k]

@njit(fastmath=FAST, error_model="numpy")
def judge(steps, row, crashed, hit, over, ended, cut, hit_of, crash_of, final_row, limit):
    rare = False
    for l in range(L):
        steps[l] += np.int32(1)
        ended[l] = (crashed[l] > F(0)) | (row[l] >= final_row)
        cut[l] = (steps[l] >= limit) & (not ended[l])
        hit_of[l] = hit[l] > 0
        crash_of[l] = crashed[l] > F(0)
        rare |= ended[l] | cut[l] | over[l]
    return rare

@njit(fastmath=FAST, error_model="numpy")
def add_noise(obs, noise, lane, key, call):
    drawn_noise = np.empty(({n_obs}, L), F)
    normal_rows(drawn_noise, noise, lane, 0, key, call)
    for k in range({n_obs}):
        for l in range(L):
            obs[k, l] += drawn_noise[k, l]
"""

ADVANCE = """
@kept
@njit(fastmath=FAST, error_model="numpy", parallel=True)
def advance(X, A, P, last, way, room, row, steps, passes, episode, over, obs, starts, targets, course, seed, p_cost, dt,
            actions, final, reward_of, ended, cut, hit_of, crash_of, final_row, obstacles, n_obstacles, low, half,
            limit, mode, p_reward, noise, key, call, parts):
    B = X.shape[0]
    {read_command}
    {read_R}
    for part in prange(parts):
        Y, D, O = np.empty(({n_x}, L), F), np.empty(({n_u}, L), F), np.empty(({n_obs}, L), F)
        I, C = np.empty(({n_x}, L), F), np.empty(({n_u}, L), F)  # what is read: state, action,
        Q, H = np.empty(({n_target}, L), F), np.empty(({n_p}, L), F)  # row of targets, the vehicle's parameters,
        E, G = np.empty(({n_u}, L), F), np.empty(({n_gates}, L), F)  # last action, next two gates
        W, Z = np.empty(L, F), np.empty(L, F)  # ways to go now and before
        progress, clearance, crashed, moved = np.empty(L, F), np.empty(L, F), np.empty(L, F), np.empty(L, F)
        paid, hit = np.empty(L, F), np.empty(L, np.int32)
        for b in range(part * B // parts, (part + 1) * B // parts):
            c = course[b]
            Xb, Ab, Pb = X[b], A[b], P[b]
            move(Xb, I)
            move(actions[b], C)
            move(Ab[:{n_target}], Q)
            move(Pb, H)
            {read_Q}
            for l in range(L):
                x = ({x_of_block},)
                d = ({clipped},)
                u = ({command},)
                x_next = step(x, u, ({P},), dt)
                q = terms(x, x_next, u, ({a},), F(0), ({Q}))
                {store_x}
                {store_d}
                W[l], clearance[l], crashed[l] = q[0], q[{clearance}], q[{n_terms} + 1]
                hit[l] = np.int32(1) if q[{n_terms}] else np.int32(0)
                dx, dy, dz = x_next[0] - x[0], x_next[1] - x[1], x_next[2] - x[2]
                moved[l] = math.sqrt(dx * dx + dy * dy + dz * dz)
            for l in range(L):
                Z[l] = way[b, l] if steps[b, l] > 0 else W[l]
            meet_obstacles(Xb, Y, moved, room[b], crashed, obstacles[c, : n_obstacles[c]])
            next_targets(Ab, row[b], passes[b], hit, targets[c], final_row[c])
            move(last[b], E)
            move(Ab[{n_target}:], G)
            for l in range(L):
                d, before = ({d},), ({before},)
                paid[l] = reward(Z[l] - W[l], clearance[l], crashed[l], F(hit[l]), d, before, ({R}))
                o = observation(({x_next},), ({gates_of_block},), d)
                {store_o}
            move(Y, Xb)
            move(D, last[b])
            move(O, obs[b])
            for l in range(L):
                way[b, l], reward_of[b, l] = W[l], paid[l]
            if judge(steps[b], row[b], crashed, hit, over[b], ended[b], cut[b], hit_of[b], crash_of[b], final_row[c],
                     limit):
                for l in range(L):
                    if over[b, l] and mode == {NEXT_STEP}:
                        ended[b, l], cut[b, l], hit_of[b, l], crash_of[b, l] = False, False, False, False
                        reward_of[b, l] = F(0)
                    done = ended[b, l] or cut[b, l]
                    again = done if mode == {SAME_STEP} else over[b, l] and mode == {NEXT_STEP}
                    over[b, l] = done and mode != {SAME_STEP}
                    if done and mode == {SAME_STEP}:
                        for k in range({n_obs}):
                            final[b, k, l] = obs[b, k, l]
                    if again:
                        restart(l, b * L + l, seed, starts[c], targets[c], Xb, Ab, Pb, last[b], room[b], row[b],
                                steps[b], passes[b], episode[b], obs[b])
            if noise[0] >= F(0):
                add_noise(obs[b], noise, b * L, key, call)

@kept
@njit(parallel=True)
def to_rows(lanes, rows):
    for b in prange(lanes.shape[0]):
        for l in range(min(L, rows.shape[0] - b * L)):
            for k in range(rows.shape[1]):
                rows[b * L + l, k] = lanes[b, k, l]

@kept
@njit(parallel=True)
def to_lanes(rows, lanes):
    for b in prange(lanes.shape[0]):
        for l in range(min(L, rows.shape[0] - b * L)):
            for k in range(rows.shape[1]):
                lanes[b, k, l] = rows[b * L + l, k]
"""
