"""A package only so that its tests are not taken for those of other folders with the same file names."""
