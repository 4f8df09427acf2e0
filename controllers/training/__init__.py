"""How a policy is learned on the compiled batch, kept with its record, and gone on with."""
