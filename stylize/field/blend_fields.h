// Between a field and its styles: mixed coefficients over one geometry.
//
// EQ(style-mix), LipRF Sec. 6.1, for several styles: s_j = (1 - sum_i a_i) s0_j + sum_i a_i
// s^i_j for each voxel j, a_i >= 0, sum a_i <= 1. A ray's colour is linear in its voxels'
// coefficients, with weights that only the geometry decides: so the mixed field renders the mix
// of the fields' renders wherever no sample's colour is clamped, at the cost of one field. As
// a map of coefficients it is a convex mix of its parts, f = (1 - sum a_i) id + sum a_i f_i,
// and its Lipschitz constant is at most theirs, mixed.
//
// With an object weight e_j in [0, 1] for each voxel (see object_weights.h), a_i e_j stands
// in place of a_i: what is not of the object stays what it was.
#pragma once

#include <vector>

#include "kernels/field/radiance_field.h"

namespace regrade {

// A source with fewer harmonics than its styles counts as padded with zeros, see PadShBasis.
// `object_weights` [voxels] may be null. Where all of a voxel but one part has weight 0, its
// coefficients are that part's, to the bit; so at the ends the fields themselves come back.
// Backgrounds, flat and on spheres, are mixed with the same weights, and stay the source's
// where `object_weights` are given.
//
// Throws Error(kUsage) for weights outside [0, 1] or with a sum above 1 (extrapolation is no
// style), Error(kInput) for styles of another geometry or basis, naming their index.
RadianceField MixFields(const RadianceField& source,
                        const std::vector<const RadianceField*>& styles,
                        const std::vector<double>& weights,
                        const std::vector<float>* object_weights = nullptr);

// Whether two fields have the same voxels, or splats, in the same places; densities too.
bool SameGeometry(const Geometry& a, const Geometry& b);

}  // namespace regrade
