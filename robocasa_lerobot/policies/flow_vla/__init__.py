"""`flow_vla`: a vision-language prefix and an action expert that turns noise into action chunks by flow matching."""
