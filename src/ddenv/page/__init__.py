"""What reports and studies are made of, and how it becomes HTML and Markdown."""
