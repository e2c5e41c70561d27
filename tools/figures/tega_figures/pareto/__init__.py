"""Codecs of recorded pictures: size against error of what is measured again."""
