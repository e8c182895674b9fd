"""The hunt: whole applications in trouble, each from one seed, in virtual time, held against promises P1 to P10."""
