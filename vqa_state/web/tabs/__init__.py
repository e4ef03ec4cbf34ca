"""The stretches of the road, one tab each."""
