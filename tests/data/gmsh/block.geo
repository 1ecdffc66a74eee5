// A block below y = 0, or its right half, for random obstacles that touch within a distance of about 1 from x = 0:
// elements of size `step` there, growing away from it. Two surfaces, so that one can be of quadrilaterals and the other
// of triangles.
SetFactory("Built-in");
DefineConstant[ width = 5, height = 4, step = 0.25, whole = 0 ];
left = -whole * width;
middle = 1.5;
Point(1) = {left, -height, 0};  Point(2) = {middle, -height, 0};  Point(3) = {width, -height, 0};
Point(4) = {width, 0, 0};       Point(5) = {middle, 0, 0};        Point(6) = {left, 0, 0};
Line(1) = {1, 2};  Line(2) = {2, 3};  Line(3) = {3, 4};  Line(4) = {4, 5};
Line(5) = {5, 6};  Line(6) = {6, 1};  Line(7) = {2, 5};
Curve Loop(1) = {1, 7, 5, 6};         Plane Surface(1) = {1};
Curve Loop(2) = {2, 3, 4, -7};        Plane Surface(2) = {2};
Physical Curve("bottom") = {1, 2};    Physical Curve("right") = {3};
Physical Curve("top") = {4, 5};       Physical Curve("left") = {6};
Physical Surface("block") = {1, 2};
// the size at a place
Field[1] = MathEval;
Field[1].F = Sprintf("%g + 0.35 * Sqrt(Max(0, Abs(x) - 1.2)^2 + y^2)", step);
Background Field = 1;
Mesh.MeshSizeExtendFromBoundary = 0;
Mesh.MeshSizeFromPoints = 0;

Include "family.geo";
