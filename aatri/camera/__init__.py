"""Interior geometry, distortion, refraction and earth curvature."""
