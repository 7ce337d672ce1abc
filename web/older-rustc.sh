#!/bin/sh
# Calls an older compiler, and names what later ones have stable to the packages that use it.
name=
previous=
for word in "$@"; do
    [ "$previous" = --crate-name ] && name=$word
    previous=$word
done
case $name in
    wide | nalgebra | simba | num_dual | leafdyn*)
        features=let_chains,unbounded_shifts,integer_sign_cast,float_next_up_down,unsigned_is_multiple_of
        features=$features,const_vec_string_slice,slice_as_chunks,extract_if,os_str_display
        exec "$@" -Z "crate-attr=feature($features)"
        ;;
esac
exec "$@"
