"""`btf_autoencoder`: an autoencoder of one fabric's bidirectional texture [Rainer2019Neural]."""
