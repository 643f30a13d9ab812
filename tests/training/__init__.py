"""How the trees of ``tracker.single_view.shape`` were learnt, to be done again.

``python -m tests.training`` renders random rooms of seeds 41 to 99 into a folder, takes windows
on people and on other things from them in three rounds, and writes the trees. Things are those
that the trees before took for people: in the first round the trees that come with the program.
It takes scikit-learn and some twenty minutes.
"""
