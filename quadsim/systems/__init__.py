"""Models x' = F(x, u), each one file of plain scalar functions."""
