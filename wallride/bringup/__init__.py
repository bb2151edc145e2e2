"""Commands of the way from box to first lap, a module each: `emulate`, `doctor`, `import`."""
