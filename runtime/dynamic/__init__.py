"""Plants with states: integration of compiled balances over a recording."""
