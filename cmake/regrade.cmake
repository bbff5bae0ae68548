# How this project makes its targets: one function for libraries, with the warnings and options all share.

add_library(regrade_flags INTERFACE)
target_include_directories(regrade_flags INTERFACE ${PROJECT_SOURCE_DIR})
# Host warnings only; nvcc passes host flags its own way.
target_compile_options(regrade_flags INTERFACE
  # -Wrestrict misfires on std::string + in GCC 12 (GCC PR 105651).
  $<$<COMPILE_LANGUAGE:CXX>:-Wall -Wextra -Wno-unknown-pragmas -Wno-missing-field-initializers -Wno-restrict>
  # GCC 13 and later take references to elements for temporaries, and parts of a std::variant for used.
  $<$<AND:$<COMPILE_LANG_AND_ID:CXX,GNU>,$<VERSION_GREATER_EQUAL:$<CXX_COMPILER_VERSION>,13>>:-Wno-dangling-reference -Wno-maybe-uninitialized>
  $<$<AND:$<BOOL:${REGRADE_WERROR}>,$<COMPILE_LANGUAGE:CXX>>:-Werror>)
# Eigen's own threads wait for each other in busy loops, and its products here are small.
target_compile_definitions(regrade_flags INTERFACE
  REGRADE_VERSION="${PROJECT_VERSION}" EIGEN_DONT_PARALLELIZE)
if(REGRADE_FUZZ)
  target_compile_options(regrade_flags INTERFACE
    -fsanitize=fuzzer-no-link,address,undefined -fno-sanitize-recover=all -fno-omit-frame-pointer -g)
  target_link_options(regrade_flags INTERFACE -fsanitize=address,undefined)
endif()
if(REGRADE_SANITIZE)
  target_compile_options(regrade_flags INTERFACE
    -fsanitize=address,undefined -fno-sanitize-recover=all -fno-omit-frame-pointer -g1)
  target_link_options(regrade_flags INTERFACE -fsanitize=address,undefined)
endif()

set(REGRADE_CUDA_FOUND FALSE)
if(NOT REGRADE_CUDA STREQUAL "OFF")
  include(CheckLanguage)
  check_language(CUDA)
  if(CMAKE_CUDA_COMPILER)
    if(NOT DEFINED CMAKE_CUDA_ARCHITECTURES)
      set(CMAKE_CUDA_ARCHITECTURES 75 80 86 89 90 120)
    endif()
    # CMake 3.25 does not know nvcc 13's C++20 flag: it drops CMAKE_CUDA_STANDARD in silence, and fails if the
    # standard is required (as C++'s is, which CUDA would take over).
    set(CMAKE_CUDA_STANDARD 20)
    set(CMAKE_CUDA_STANDARD_REQUIRED OFF)
    string(APPEND CMAKE_CUDA_FLAGS " -std=c++20 --expt-relaxed-constexpr -diag-suppress=20012 -Xcompiler=-fopenmp")
    enable_language(CUDA)
    set(REGRADE_CUDA_FOUND TRUE)
  elseif(REGRADE_CUDA STREQUAL "ON")
    message(FATAL_ERROR "REGRADE_CUDA=ON, but no CUDA compiler was found; put nvcc on PATH or set CUDACXX")
  endif()
endif()
message(STATUS "regrade: CUDA ${REGRADE_CUDA} -> ${REGRADE_CUDA_FOUND}")

# regrade_batches(name): with REGRADE_BATCHES the sources of a target are compiled eight at a time, in a third of the time:
# headers are read once for all. Those with flags of their own stay alone, and those with SKIP_UNITY_BUILD_INCLUSION: tests
# whose helpers have the names of another's.
function(regrade_batches name)
  if(REGRADE_BATCHES)
    set_target_properties(${name} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 8)
    # What a source's own types have of its anonymous namespace seems to come from a header.
    target_compile_options(${name} PRIVATE $<$<COMPILE_LANG_AND_ID:CXX,GNU>:-Wno-subobject-linkage>)
    # GCC before 14 computes two floats in registers of four, whose other two hold anything (GCC PR 110762): now and then a
    # signalling NaN, at which the tests' floating-point traps end a program.
    target_compile_options(${name} PRIVATE $<$<COMPILE_LANG_AND_ID:CXX,GNU>:-fno-tree-slp-vectorize>)
  endif()
endfunction()

# GNU ld takes five times as long as gold, and there are a hundred programs.
include(CheckLinkerFlag)
check_linker_flag(CXX -fuse-ld=gold REGRADE_GOLD)
if(REGRADE_GOLD AND NOT REGRADE_CUDA_FOUND)
  target_link_options(regrade_flags INTERFACE -fuse-ld=gold)
endif()

# Sources compile in two thirds of the time: those of tests, and those that call others and wait for none of their own
# loops.
# GCC 12 at -O1 takes parts of a std::variant for used before they are set.
set(regrade_quick_options $<$<CONFIG:Release>:-O1> $<$<COMPILE_LANG_AND_ID:CXX,GNU>:-Wno-maybe-uninitialized>)

# regrade_library(name [QUICK] SOURCES... [LINK libs...]): a static library; its .cu files are C++ when CUDA is off.
# QUICK: with regrade_quick_options.
function(regrade_library name)
  cmake_parse_arguments(ARG "QUICK" "" "SOURCES;LINK" ${ARGN})
  add_library(${name} STATIC ${ARG_SOURCES})
  set_property(GLOBAL APPEND PROPERTY REGRADE_LIBRARIES ${name})
  target_link_libraries(${name} PUBLIC regrade_flags ${ARG_LINK})
  if(ARG_QUICK)
    target_compile_options(${name} PRIVATE ${regrade_quick_options})
  endif()
  regrade_batches(${name})
  if(NOT REGRADE_CUDA_FOUND)
    foreach(source ${ARG_SOURCES})
      if(source MATCHES "\\.cu$")
        set_source_files_properties(${source} PROPERTIES LANGUAGE CXX COMPILE_OPTIONS "-xc++")
      endif()
    endforeach()
  endif()
endfunction()

# regrade_module(name user SOURCES...): regrade_*.so, which library `user` loads when it needs it (program_module.h).
function(regrade_module name user)
  add_library(${name} MODULE ${ARGN})
  target_link_libraries(${name} PRIVATE regrade_flags)
  set_target_properties(${name} PROPERTIES PREFIX "" LIBRARY_OUTPUT_DIRECTORY "${PROJECT_BINARY_DIR}/modules")
  add_dependencies(${user} ${name})
  install(TARGETS ${name} DESTINATION ${CMAKE_INSTALL_LIBDIR}/regrade)
endfunction()

# regrade_instruction_sets(name stem): STEM_avx2.cc and STEM_avx512.cc of library `name` get the flags of their
# instruction set, and they alone: a global -march would change Eigen's memory layout between us and Debian's Ceres.
function(regrade_instruction_sets name stem)
  if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
    target_compile_definitions(${name} PRIVATE REGRADE_X86)
    set_source_files_properties(${stem}_avx2.cc PROPERTIES COMPILE_OPTIONS "-mavx2;-mfma;-mf16c")
    set_source_files_properties(${stem}_avx512.cc PROPERTIES COMPILE_OPTIONS
      "-mavx512f;-mavx512vl;-mavx512dq;-mavx512bw;-mfma;-mf16c;-mprefer-vector-width=512")
  endif()
endfunction()

# regrade_test(name SOURCES... LINK libs... [PARTS n] [COST seconds]): one GoogleTest program, one CTest test: to start a
# program takes longer than most cases. With PARTS n, for long programs, it is n tests, NAME_1 to
# NAME_n, which share the cases; the costly begin first.
function(regrade_test name)
  cmake_parse_arguments(ARG "" "COST;PARTS" "SOURCES;LINK" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE regrade_flags source_dir ${ARG_LINK} GTest::gtest GTest::gtest_main)
  target_compile_options(${name} PRIVATE ${regrade_quick_options})
  regrade_batches(${name})
  if(REGRADE_BATCHES)
    target_precompile_headers(${name} REUSE_FROM regrade_precompiled)
    # From precompiled headers GCC 12 gives these warnings of the standard library's own sources, too.
    target_compile_options(${name} PRIVATE -Wno-array-bounds -Wno-stringop-overflow)
  endif()
  if(NOT ARG_PARTS)
    set(ARG_PARTS 1)
  endif()
  foreach(part RANGE 1 ${ARG_PARTS})
    if(ARG_PARTS EQUAL 1)
      set(test ${name})
    else()
      set(test ${name}_${part})
    endif()
    add_test(NAME ${test} COMMAND ${name} --gtest_brief=1)
    math(EXPR index "${part} - 1")
    # Idle OpenMP threads sleep: tests run side by side, and spinning ones would take each other's cores.
    set_tests_properties(${test} PROPERTIES TIMEOUT 600
      ENVIRONMENT "OMP_WAIT_POLICY=passive;GTEST_TOTAL_SHARDS=${ARG_PARTS};GTEST_SHARD_INDEX=${index}")
    if(ARG_COST)
      set_tests_properties(${test} PROPERTIES COST ${ARG_COST})
    endif()
  endforeach()
endfunction()
