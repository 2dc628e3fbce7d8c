"""Commands about who may reach a farm: certificates, tokens, the audit log."""
