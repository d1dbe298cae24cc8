"""The study: many reductions side by side, and the paper's tables and figures of them."""
