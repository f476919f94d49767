"""What a flight leaves behind: runs, their folders on the disk, and the numbers read off them."""
