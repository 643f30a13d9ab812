"""The common part of the colour methods: templates, likelihood and its peaks."""
