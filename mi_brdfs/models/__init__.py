"""The models, one file each; importing ``mi_brdfs`` discovers them."""
