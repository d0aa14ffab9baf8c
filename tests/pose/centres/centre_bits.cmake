# The programs of same_bits_test.py, for the PC and for the camera box.
get_target_property(centres_sources tbm_pose_centres SOURCES)
get_target_property(centres_folder tbm_pose_centres SOURCE_DIR)
list(TRANSFORM centres_sources PREPEND ${centres_folder}/)
tbm_library(pose_centres_plain ALONE SOURCES ${centres_sources} DEPS tbm_pose_base Eigen3::Eigen)
target_compile_definitions(tbm_pose_centres_plain PRIVATE TBM_PLAIN_VECTORS)
tbm_program(centre_bits SOURCES ${CMAKE_CURRENT_LIST_DIR}/centre_bits.cc
  DEPS tbm_pose_centres tbm_test_support)
tbm_program(centre_bits_plain SOURCES ${CMAKE_CURRENT_LIST_DIR}/centre_bits.cc
  DEPS tbm_pose_centres_plain tbm_test_support)
