"""What readings a plant should give: equations solved, balances integrated."""
