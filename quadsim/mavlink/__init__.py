"""The simulator behind MAVLink: a stand-in for the simulator of the AI Grand Prix, over UDP."""
