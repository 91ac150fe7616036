"""What needs no training of a network: floors and ceilings for every learned number."""
