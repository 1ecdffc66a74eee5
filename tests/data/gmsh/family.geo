// family 8: quadrilaterals, 6: triangles, 0: quadrilaterals in the first surface, triangles in the second.
DefineConstant[order = 2]; Mesh.ElementOrder = order;
DefineConstant[complete = 0]; Mesh.SecondOrderIncomplete = 1 - complete; // 8 nodes, or 9
Mesh.Algorithm = 6;
Mesh.RecombinationAlgorithm = 2; // quadrilaterals only
If (family == 8)
  Recombine Surface {1, 2};
EndIf
If (family == 0)
  Recombine Surface {1};
EndIf
