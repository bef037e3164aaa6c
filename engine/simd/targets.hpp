/// To be included, after HWY_TARGET_INCLUDE is defined, by every source that is compiled once for each instruction set.
///
/// The sets: AVX-512 (AVX3 in Highway's words), AVX2 with fused multiply-add, and plain loops for everything else. Sets
/// between these are left out: they would be compiled and tested for machines that are not used for studies.
#ifndef HWY_DISABLED_TARGETS
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_SSE4 | HWY_AVX3_DL)
#endif
#include <hwy/foreach_target.h>  // re-includes the source; must come before highway.h
#include <hwy/highway.h>
