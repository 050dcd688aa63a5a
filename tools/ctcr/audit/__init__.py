"""What a table says about itself before any physics: outliers, missing motion, an unknown sensor roll."""
