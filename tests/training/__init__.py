"""How the trees of ``tracker.single_view.shape`` were learnt, to be done again.

``python -m tests.training`` renders random rooms of seeds 0 to 99 into a folder, takes windows
on people and on other things from them in three rounds, each with those that the trees
before took for people, of the first round those that come with the program, and writes the trees. It takes scikit-learn and some twenty minutes.
"""
