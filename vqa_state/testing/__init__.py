"""What tests of models need: a model without a network.

Ships with the package for tests of your own models; the app never offers it.
"""
