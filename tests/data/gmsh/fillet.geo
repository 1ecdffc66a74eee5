// A plate 4 wide that steps from height 2 to height 1, the inner corner rounded with radius .5.
// left, bottom: supports; top: contact; fillet: curved sides. Two surfaces, so that one can be of
// quadrilaterals and the other of triangles.
SetFactory("Built-in");
h = 0.5;
Point(1) = {0, 0, 0, h};     Point(2) = {2, 0, 0, h};    Point(3) = {4, 0, 0, h};
Point(4) = {4, 1, 0, h};     Point(5) = {2.5, 1, 0, h/3}; Point(6) = {2.5, 1.5, 0, h};
Point(7) = {2, 1.5, 0, h/3}; Point(8) = {2, 2, 0, h};    Point(9) = {0, 2, 0, h};
Line(1) = {1, 2};  Line(2) = {2, 3};  Line(3) = {3, 4};  Line(4) = {4, 5};
Circle(5) = {5, 6, 7};
Line(6) = {7, 8};  Line(7) = {8, 9};  Line(8) = {9, 1};  Line(9) = {2, 7};
Curve Loop(1) = {1, 9, 6, 7, 8};      Plane Surface(1) = {1};
Curve Loop(2) = {2, 3, 4, 5, -9};     Plane Surface(2) = {2};
Physical Curve("bottom") = {1, 2};    Physical Curve("right end") = {3};
Physical Curve("fillet") = {5};       Physical Curve("top") = {7};
Physical Curve("left") = {8};         Physical Curve("seam") = {9};
Physical Surface("thick") = {1};      Physical Surface("thin") = {2};
Physical Point("corner") = {1};

Include "family.geo";
