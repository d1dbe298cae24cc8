"""Workers on other machines, through a Dask cluster."""
