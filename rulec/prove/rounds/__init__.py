"""A second round: the tool proposes inputs, the same true plant is run with them and with others,
and the tool is asked again."""
