"""What SLAM would meet in a bag: findings, and the overlay that suits it."""
