"""The seabed as a chart: where it lies on the earth, how uncertain it is, S-44's orders."""
