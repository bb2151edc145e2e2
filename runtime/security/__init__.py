"""Who may do what: certificates, the access list, the folder of keys."""
