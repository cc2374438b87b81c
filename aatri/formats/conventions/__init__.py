"""What programs mean by the numbers they write: axes and sense of rotations, distortion models. Tables, not ifs."""
