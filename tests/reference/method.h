// SPDX-License-Identifier: Apache-2.0
// The method's constants as the references know them: numbers of their own, so that a wrong one of the kernels shows.
#pragma once

namespace egosgm::reference {

inline constexpr int kCoarseMinCount = 8;
inline constexpr int kCoarseOutliers = 2;
inline constexpr float kCoarseFartherPx = 3.0f;
inline constexpr float kCoarseConfirmsPx = 6.0f;
inline constexpr float kThinJumpPx = 3.0f;
inline constexpr int kThinBlocks = 2;
inline constexpr int kThinReach = 8;
// Evidence, in sixteenths of a bit; controls in pixels from the match.
inline constexpr int kControls[4] = {-14, -8, 8, 14};
inline constexpr int kCoarseControls[8] = {-19, -14, -10, -7, 7, 10, 14, 19};
inline constexpr int kConfirmedEvidence = 64;
inline constexpr int kEvidenceOfChoice = 48;
inline constexpr int kEvidenceOfNoise = 24;
inline constexpr int kEvidenceWeight = 4;
inline constexpr int kMostEvidence = 160;
inline constexpr int kTrustedEvidence = 96;
inline constexpr int kDynamicAgrees = 24;
inline constexpr float kDynamicAlikePart = 0.03f;
inline constexpr float kDynamicAlikePx = 1.0f;
inline constexpr int kDynamicBlock = 4;
inline constexpr int kDynamicDepthVotes = 22;
inline constexpr int kDynamicDifferentBits = 7;
inline constexpr int kDynamicGainHalfBits = 5;
inline constexpr int kDynamicHiddenBits = 5;
inline constexpr float kDynamicHidesPx = 1.0f;
inline constexpr float kDynamicLeastPx = 1.0f;
inline constexpr int kDynamicLeastSquare = 164;
inline constexpr int kDynamicMaxBlock = 16;
inline constexpr float kDynamicMostPx = 3.0f;
inline constexpr float kDynamicNewPx = 1.5f;
inline constexpr float kDynamicPart = 0.05f;
inline constexpr int kDynamicRatioTenths = 7;
inline constexpr int kDynamicReach = 3;
inline constexpr int kDynamicShare = 3;
inline constexpr int kDynamicVotes = 6;
inline constexpr float kDoubtfulVariancePx2 = 16.0f;
inline constexpr float kFilledVariancePx2 = 1.0f;
inline constexpr std::size_t kFillMinCount = 6;
inline constexpr int kJumpDistance = 2;
inline constexpr float kLeastChange = 2.0f;
inline constexpr int kLeastRepeatPx = 4;
inline constexpr float kMaxJumpPx = 10.0f;
inline constexpr float kMaxMeanVariancePx2 = 2.0f;
inline constexpr float kMaxRoughnessPx = 1.5f;
inline constexpr float kMaxVariancePx2 = 1e6f;
inline constexpr float kMinDepthRatio = 1e-6f;
inline constexpr int kRepeatBits = 3;
inline constexpr int kRepeatRadius = 8, kRepeatStep = 4;
inline constexpr float kRightMapStepsPerPx = 65536.0f;
inline constexpr float kRowsAgreePx = 3.0f;
inline constexpr int kRoughnessRadius = 3;
inline constexpr int kTextureRadius = 4;
inline constexpr float kUncoveredJumpPx = 3.0f;
inline constexpr int kUncoveredRadius = 8;
inline constexpr int kVarianceRadius = 8;
inline constexpr int kVarianceStep = 4;
inline constexpr int kVoteGreys = 48;

}  // namespace egosgm::reference
