"""Access control: certificates, the access list, the folder of keys."""
