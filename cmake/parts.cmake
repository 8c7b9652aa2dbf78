# The parts of the library that a build, and a program that uses what is installed, may do without, each behind the one that it
# needs. The build reads this file, and find_package(interneuron) the copy that is installed.
set(INTERNEURON_ALL_PARTS monitor ring xdp pcap)
set(INTERNEURON_monitor_PACKAGES LIBNL libnl-route-3.0)
set(INTERNEURON_ring_NEEDS monitor)
set(INTERNEURON_xdp_NEEDS ring)
set(INTERNEURON_xdp_PACKAGES LIBXDP libxdp libbpf)
set(INTERNEURON_pcap_PACKAGES LIBPCAP libpcap)

# Sets `out` to what this host, or a build with only the parts that follow, lacks for a part; empty: nothing.
function(interneuron_part_lacks out part)
  set(lacks)
  if(INTERNEURON_${part}_NEEDS AND NOT INTERNEURON_${part}_NEEDS IN_LIST ARGN)
    set(lacks "the part ${INTERNEURON_${part}_NEEDS}")
  elseif(INTERNEURON_${part}_PACKAGES)
    set(modules ${INTERNEURON_${part}_PACKAGES})
    list(POP_FRONT modules prefix)
    pkg_check_modules(${prefix} QUIET IMPORTED_TARGET GLOBAL ${modules})
    if(NOT ${prefix}_FOUND)
      list(JOIN modules " and " lacks)
    endif()
  endif()
  set(${out} "${lacks}" PARENT_SCOPE)
endfunction()
