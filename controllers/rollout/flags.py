"""How far compiled arithmetic may differ from what is written."""

# Fused multiply-add, reciprocals, either zero. Not reassociation: the order of a sum would then be the
# compiler's, and code just compiled and the same code from the cache have been seen to choose differently.
FAST = {"contract", "arcp", "nsz"}
