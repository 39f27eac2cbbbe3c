"""The proof on concealed effects: scores of a run, its page, and what others would make of it.

`results` is what is known of a judged case, `scores` makes the tables of them, `page` (with
`pictures`) writes one HTML file and `tell` the terminal's text. `baselines` (with `aligned`,
`trees` and `sparse`) mends predictions by learning alone: boosted trees, and sparse regression of
laws and maps. They predict and name nothing, so they stand beside held-out errors, nowhere else.
"""
