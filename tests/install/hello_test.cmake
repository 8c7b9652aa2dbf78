cmake_minimum_required(VERSION 3.25)
include(${CMAKE_CURRENT_LIST_DIR}/installed.cmake)

# A build of the program alone, as scripts/demo.sh makes it, must leave everything that is installed.
if(GENERATOR STREQUAL "Ninja" AND EXISTS ${BINARY_DIR}/interneuron)
  run(${CMAKE_COMMAND} --build ${BINARY_DIR} --target interneuron -- -t query interneuron)
  if(NOT output MATCHES "libinterneuron.a")
    message(FATAL_ERROR "the program does not depend on the library:\n${output}")
  endif()
endif()

build(examples)
build(examples/own_policy)

expect("road: hello\n" examples/hello)
expect("vehicle: delivered after [0-9.]+ ms\n" examples/hello)
expect("road: hello\nvehicle: delivered after [0-9.]+ ms\n" examples/two_endpoints)
foreach(example camera_offload lidar_offload four_stages)
  expect("^${example}: " examples/${example} --help)
endforeach()
expect("camera  9: " examples/camera_offload)
expect("lidar  9: " examples/lidar_offload)
expect("camera  [0-9]: +[0-9.]+ ms remote detected, tracked\n.*lidar   9: " examples/four_stages)
expect("patient +variant 0 over link 3;" examples/own_policy/own_policy)
