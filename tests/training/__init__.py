"""How the trees of ``tracker.single_view.shape`` were learnt, to be done again.

``python -m tests.training`` renders random rooms of seeds 0 to 99 into a folder, takes windows
on people and on other things from them in two rounds, the second with those that the trees of
the first took for people, and writes the trees. It takes scikit-learn and some twenty minutes.
"""
