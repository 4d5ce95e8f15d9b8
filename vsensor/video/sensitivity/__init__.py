"""How much a camera that stands elsewhere than thought changes the offsets (P2 2.6.1.2)."""
