// The tapered sheet of thesis 4.3, upper half: y = 0 is its line of symmetry. Two surfaces, so that
// one can be of quadrilaterals and the other of triangles.
SetFactory("Built-in");
h = 0.5;
Point(1) = {0, 0, 0, h};   Point(2) = {1, 0, 0, h};     Point(3) = {5, 0, 0, h};
Point(4) = {5, 0.5, 0, h}; Point(5) = {3, 0.5, 0, h/2}; Point(6) = {1, 1, 0, h/2};
Point(7) = {0, 1, 0, h};
Line(1) = {1, 2};  Line(2) = {2, 3};  Line(3) = {3, 4};  Line(4) = {4, 5};
Line(5) = {5, 6};  Line(6) = {6, 7};  Line(7) = {7, 1};  Line(8) = {2, 6};
Curve Loop(1) = {1, 8, 6, 7};         Plane Surface(1) = {1};
Curve Loop(2) = {2, 3, 4, 5, -8};     Plane Surface(2) = {2};
Physical Curve("bottom") = {1, 2};    Physical Curve("right") = {3};
Physical Curve("taper") = {5};
Physical Surface("sheet") = {1, 2};

Include "family.geo";
