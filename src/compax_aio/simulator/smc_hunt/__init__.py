"""The hunt on a party line: whole applications with several SMC axes in trouble, each from one seed."""
