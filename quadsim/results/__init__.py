"""What a flight or a heat leaves behind, as the library hands it out: Run, Heat, tables of them."""
