"""Other methods on the same real rigs: what they predict of unseen rows, and what they name.

`python -m tests.rig.peers RIGS KEPT` takes a folder of rigs and what `rulec prove --real RIGS
--keep KEPT` left. Every peer corrects the recalibrated plant's prediction of the reading that
counts. It learns from the training recording alone: of the unseen rows it gets only what a
simulation is given. Ours beside them is the adopted plant. They need the extra `prove`; where
something is missing by structure alone is told if the extra `bench` is there, too.
"""
