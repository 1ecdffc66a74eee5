// Half of a block under a cylinder: unstructured triangles that grow away from the contact at the
// upper left corner.
SetFactory("Built-in");
Mesh.ElementOrder = 2;
Mesh.Algorithm = 6;
Point(1) = {0, 0, 0};  Point(2) = {40, 0, 0};  Point(3) = {40, -40, 0};  Point(4) = {0, -40, 0};
Point(5) = {1.2, 0, 0};
Line(1) = {1, 5}; Line(2) = {5, 2};  Line(3) = {2, 3};  Line(4) = {3, 4};  Line(5) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4, 5};  Plane Surface(1) = {1};
Physical Curve("contact") = {1};  Physical Curve("base") = {4};  Physical Curve("axis") = {5};
Physical Curve("right") = {3};    Physical Surface("block") = {1};
// the size at a distance d from the middle of the contact
Field[1] = MathEval;
Field[1].F = "0.05 + 0.25 * (Max(0, Sqrt(x^2 + y^2) - 0.7))";
Background Field = 1;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.MeshSizeFromPoints = 0;
