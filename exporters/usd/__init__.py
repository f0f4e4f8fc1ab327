"""The USD side: any stage that usd-core opens, to glTF."""
