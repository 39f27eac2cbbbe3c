"""Plants that store: balances fitted to windows of the recording, without and with each fault."""
