"""How ``rules`` reads and carries out flight directives."""
