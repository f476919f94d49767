"""Gates in pictures: their edges are predicted from the estimate, and searched for near there.

edges.py         the edges that separate a frame from what is behind it, and points on them
signal.py        how much a pixel has of the gates' colour; steps of it along lines
lines.py         a line through what was found of each edge, corners where two lines meet
pose_fit.py      the pose that fits the lines of all gates
hypotheses.py    the pose that explains a picture best, if the estimate is too uncertain
network.py       the network that finds gates without an estimate
network_pose.py  the pose that explains the gates that the network has found
tracker.py       all of it, for one picture
"""
