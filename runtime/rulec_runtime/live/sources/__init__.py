"""Where rows come from: a file that grows, standard input, OPC UA, MQTT."""
