"""Resolution of identities: tracks are split into tracklets, and these are linked."""
