"""What the skills plan with: kinematics, grasps."""
