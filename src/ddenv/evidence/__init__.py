"""What runs show: rates, certificates and their claims, and what a finished run implies of
others.
"""
