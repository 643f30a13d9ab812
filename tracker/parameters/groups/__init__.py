"""The parameters of each method and stage, a group a module, with the description of the method."""
