"""`wallride lab tune`: a study of settings with Optuna. Read: `space`, `study`, `verdict`, `settings_file`, `page`."""
